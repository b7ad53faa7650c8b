// A closed box of sheets, 160 x 100 x 50 mm, for electronics: benchmarks/drop_on_corners.py.
a = 0.16; b = 0.10; c = 0.05;
Point(1) = {0, 0, 0}; Point(2) = {a, 0, 0}; Point(3) = {a, b, 0}; Point(4) = {0, b, 0};
Point(5) = {0, 0, c}; Point(6) = {a, 0, c}; Point(7) = {a, b, c}; Point(8) = {0, b, c};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Line(5) = {5, 6}; Line(6) = {6, 7}; Line(7) = {7, 8}; Line(8) = {8, 5};
Line(9) = {1, 5}; Line(10) = {2, 6}; Line(11) = {3, 7}; Line(12) = {4, 8};
Curve Loop(1) = {-4, -3, -2, -1}; Plane Surface(1) = {1};
Curve Loop(2) = {5, 6, 7, 8}; Plane Surface(2) = {2};
Curve Loop(3) = {1, 10, -5, -9}; Plane Surface(3) = {3};
Curve Loop(4) = {2, 11, -6, -10}; Plane Surface(4) = {4};
Curve Loop(5) = {3, 12, -7, -11}; Plane Surface(5) = {5};
Curve Loop(6) = {4, 9, -8, -12}; Plane Surface(6) = {6};
Physical Surface("skin") = {1, 2, 3, 4, 5, 6};
Mesh.MeshSizeMax = 0.012;

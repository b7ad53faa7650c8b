// A rectangular panel of three zones, 600 x 400 mm: demos/guard_thickness.py.
Point(1) = {-0.1, -0.07, 0}; Point(2) = {0.1, -0.07, 0}; Point(3) = {0.1, 0.07, 0}; Point(4) = {-0.1, 0.07, 0};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Point(5) = {-0.2, -0.14, 0}; Point(6) = {0.2, -0.14, 0}; Point(7) = {0.2, 0.14, 0}; Point(8) = {-0.2, 0.14, 0};
Line(5) = {5, 6}; Line(6) = {6, 7}; Line(7) = {7, 8}; Line(8) = {8, 5};
Curve Loop(2) = {5, 6, 7, 8};
Point(9) = {-0.3, -0.2, 0}; Point(10) = {0.3, -0.2, 0}; Point(11) = {0.3, 0.2, 0}; Point(12) = {-0.3, 0.2, 0};
Line(9) = {9, 10}; Line(10) = {10, 11}; Line(11) = {11, 12}; Line(12) = {12, 9};
Curve Loop(3) = {9, 10, 11, 12};
Plane Surface(1) = {1}; Plane Surface(2) = {2, 1}; Plane Surface(3) = {3, 2};
Physical Surface("middle") = {1}; Physical Surface("ring") = {2}; Physical Surface("rim") = {3};
Physical Curve("held") = {9, 10, 11, 12};
Mesh.MeshSizeMax = 0.05;

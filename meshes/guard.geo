// Posts and rails of a machine guard, 1.2 m wide and 1.8 m high: demos/machine_guard.py.
a = 1.2; b = 0.15; c = 1.75; h = 1.8;
Point(1) = {0, 0, 0}; Point(2) = {0, 0, b}; Point(3) = {0, 0, c}; Point(4) = {0, 0, h};
Point(5) = {a, 0, 0}; Point(6) = {a, 0, b}; Point(7) = {a, 0, c}; Point(8) = {a, 0, h};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4};
Line(4) = {5, 6}; Line(5) = {6, 7}; Line(6) = {7, 8};
Line(7) = {2, 6}; Line(8) = {3, 7};
Physical Point("feet") = {1, 5};
Physical Curve("posts") = {1, 2, 3, 4, 5, 6};
Physical Curve("rails") = {7, 8};
Mesh.MeshSizeMax = 0.05;

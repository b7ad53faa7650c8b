// The line of a tube, 2.436 m long, in 48 elements: benchmarks/tube_between_stops.py.
l = 2.436;
Point(1) = {0, 0, 0}; Point(2) = {l, 0, 0};
Line(1) = {1, 2};
Transfinite Curve {1} = 49;
Physical Curve("tube") = {1};
Physical Point("clamp") = {1};

// The tank head of tank.step in metres, its edges by name, and the sizes of tank.msh.
SetFactory("OpenCASCADE");
Geometry.OCCTargetUnit = "M";
Merge "tank.step";
Coherence; // faces of a STEP file do not share their edges until they are joined

// Edges are found by the boxes they lie in: their numbers differ from one OpenCASCADE to the next.
rim() = Curve In BoundingBox {-0.301, -0.301, -0.001, 0.301, 0.301, 0.001};
hole() = Curve In BoundingBox {0.049, -0.061, 0.15, 0.171, 0.061, 0.22};

Physical Surface("tank") = Surface {:};
Physical Curve("rim") = rim();   // where the tank's shell would go on
Physical Curve("hole") = hole(); // edge of the manhole

Mesh.ElementOrder = 2;
Mesh.MeshSizeMax = 0.04;
MeshSize {PointsOf {Curve {hole()};}} = 0.02;

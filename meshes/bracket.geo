// The bracket of bracket.step in metres, its faces by name, and the sizes of bracket.msh.
SetFactory("OpenCASCADE");
Geometry.OCCTargetUnit = "M";
Merge "bracket.step";

// Faces are found by the boxes they lie in: their numbers differ from one OpenCASCADE to the next.
front() = Surface In BoundingBox {0.0275, 0.0115, 0.0415, 0.0285, 0.0485, 0.0785};
eye() = Surface In BoundingBox {0.0145, 0.0115, 0.0415, 0.0285, 0.0485, 0.0785};
eye() -= front();
bore() = Surface In BoundingBox {-0.0005, 0.0185, 0.0485, 0.0285, 0.0415, 0.0715};
base() = Surface In BoundingBox {-0.0005, -0.0005, -0.0005, 0.0845, 0.0605, 0.0005};
clamp() = Surface In BoundingBox {0.0545, 0.0045, -0.0005, 0.0735, 0.0235, 0.0105};
clamp() += Surface In BoundingBox {0.0545, 0.0365, -0.0005, 0.0735, 0.0555, 0.0105};

Physical Volume("body") = Volume {:};
Physical Surface("clamp") = clamp(); // bolt holes and the seats of the bolt heads
Physical Surface("base") = base();   // underside
Physical Surface("eye") = eye();     // outside of the boss: a cylinder of radius 18 mm
Physical Surface("bore") = bore();
Physical Surface("front") = front(); // end of the boss

Mesh.ElementOrder = 2;
Mesh.MeshSizeMax = 0.005;
MeshSize {PointsOf {Surface {eye(), bore(), clamp()};}} = 0.0035;

"""The 3D view of the collision scene; where there is no OpenGL, top and side projections."""

"""The collision model: scene, gate on the swept volume, and the process it runs in."""

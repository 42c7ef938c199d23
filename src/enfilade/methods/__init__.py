"""Methods: how frames are made from a scene and a camera path. One folder, or one file, a method."""

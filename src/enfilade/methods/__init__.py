"""Methods, which make frames from a scene and a camera path. One folder, or one file, a method."""

"""What the files of a platform say, read and checked."""

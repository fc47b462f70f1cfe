"""What is measured, one group of rows a file; each has `measure(rig)`."""

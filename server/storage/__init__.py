"""What is kept on the disk: who may use a data folder, and files that cannot be read."""

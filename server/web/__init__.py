"""What a browser asks for: routes, files and the two sockets."""

"""The shell of catgraph: everything that touches the world."""

"""A simulated car behind a rosbridge of our own, with faults on demand."""

"""The commands of `catgraph`, one file each: parse, call, print."""

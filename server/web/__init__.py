"""The HTTP side: routes, files and the page's socket."""

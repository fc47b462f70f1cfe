"""Tables of authorities as templates: their columns are data, for their rules change."""

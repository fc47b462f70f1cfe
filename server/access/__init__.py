"""Who is asking, what each may do, and who is in control."""

"""Who may command a car."""

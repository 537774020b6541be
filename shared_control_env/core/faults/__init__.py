"""What goes wrong with the automation: degradations of its command and of its perception."""

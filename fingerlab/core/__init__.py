"""What every part needs: the errors that reach a user, a second process, what a user has confirmed."""

"""The page that the tests write: every check, its tolerance and today's value."""

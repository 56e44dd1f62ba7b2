"""What is read: manifest, videos, sound, markers and board."""

"""What a notebook calls: parameters checked, results shown, controls."""

"""What a person looks at: plots as PNG bytes, and the browser viewer."""

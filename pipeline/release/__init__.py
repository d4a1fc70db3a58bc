"""The page that a person signs before hardware."""

"""The report that a person signs before a policy runs on hardware."""

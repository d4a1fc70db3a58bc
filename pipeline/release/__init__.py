"""Release report of a policy, which a person signs before the policy runs on hardware."""

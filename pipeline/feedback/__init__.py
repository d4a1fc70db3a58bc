"""From failures to bounded changes of what is curated, randomized and calibrated; nothing takes effect unapproved."""

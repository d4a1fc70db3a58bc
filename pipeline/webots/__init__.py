"""A Webots project of a robot folder, its controller, and stand-ins that run it without Webots."""

"""A Webots project of a robot folder, the controller that runs in it, a stand-in for where Webots is missing."""

"""A trained policy as others take it: ONNX, TorchScript, a task folder for booster_deploy, golden vectors, a card."""

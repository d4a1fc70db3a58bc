"""Files: atomic writes, content-addressed blobs, manifests, settings. No clip maths."""

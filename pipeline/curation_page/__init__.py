"""The curator's page: find, play, accept and exclude clips, compare databases, answer proposals.

    manifests in the store -> table of clips -> gallery in the browser
    clips in the store -> line figures -> thumbnails and playback
    decisions of a person -> data/curation.yaml, data/feedback/

The server only answers this machine (`guard`). The static files need no build step.
"""

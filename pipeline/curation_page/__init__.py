"""The curator's page: find, watch, accept and exclude clips, compare databases, answer proposals.

    manifests in the store -> table of clips -> gallery in the browser
    clips in the store -> line figures -> thumbnails and playback
    decisions of a person -> data/curation.yaml, data/feedback/

Served to this machine alone (`guard`), with static files that need no build step.
"""

"""The live view: a scene that is rendered while it is looked at, in a browser.

``server`` passes messages between browsers and the `worker`, the one thread that renders, whose
sessions each show a `state`: a scene with `edits`, seen by one or two estimators.
"""

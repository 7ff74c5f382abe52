"""The course's pictures on a page: rendered, measured, and asked what they teach.

`figures` says which pictures there are, `rendering` makes and measures them, `questions` and the
modules that it lists answer from them, `page` writes it all down.
"""

from drpt.gallery.making import make_gallery

__all__ = ["make_gallery"]

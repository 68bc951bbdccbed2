"""Views of files: the page in the browser, playback of recorded worlds, reports.

In: the files of all other rooms. Out: pages, images, films.
"""

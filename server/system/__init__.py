"""The process itself: supervised tasks, memory, open files, clean text, the folders of the page."""

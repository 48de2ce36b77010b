"""What a test has going on beside itself."""

import threading


class Beside:
    """`run` in a thread of its own, as long as this is used as a context; it ends soon after `stop` is set."""

    def __init__(self):
        self.stop = threading.Event()
        self.thread = threading.Thread(target=self.run, daemon=True)

    def run(self):
        raise NotImplementedError

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.stop.set()
        self.thread.join()

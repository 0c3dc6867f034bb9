"""A serial port for software that wants one: what goes over it is forwarded to a TCP port that speaks slcan."""

import os
import pty
import select
import socket
import threading
import tty


class SlcanPort:
    """A pseudo-terminal, forwarded until it is closed; `name` is what a program opens."""

    def __init__(self, tcp_port):
        self.tcp = socket.create_connection(("127.0.0.1", tcp_port))
        self.master, self.slave = pty.openpty()
        tty.setraw(self.slave)
        self.name = os.ttyname(self.slave)
        self.over = threading.Event()
        self.thread = threading.Thread(target=self.forward)
        self.thread.start()

    def forward(self):
        while not self.over.is_set():
            readable, _, _ = select.select([self.tcp, self.master], [], [], 0.1)
            if self.tcp in readable:
                received = self.tcp.recv(65536)
                if not received:
                    return
                os.write(self.master, received)
            if self.master in readable:
                self.tcp.sendall(os.read(self.master, 65536))

    def close(self):
        self.over.set()
        self.thread.join()
        self.tcp.close()
        os.close(self.master)
        os.close(self.slave)

# SPDX-License-Identifier: GPL-2.0-or-later
"""A time-stamp authority over HTTP, of openssl.

authority.py TSA.CNF PORT.FILE: writes its port to the file. POST /tsr answers the query, /old answers
as to the first query that it got, /large sends a megabyte, /page another type.
"""
import http.server
import os
import subprocess
import sys


class Authority(http.server.BaseHTTPRequestHandler):
    first = None

    def do_POST(self):
        query = self.rfile.read(int(self.headers["Content-Length"]))
        Authority.first = Authority.first or query
        kind = "application/timestamp-reply"
        if self.headers["Content-Type"] != "application/timestamp-query":
            self.send_error(415)
            return
        if self.path == "/large":
            answer = b"\x30\x83\x10\x00\x00" + bytes(1 << 20)
        elif self.path == "/page":
            kind, answer = "text/html", b"<html></html>"
        else:
            asked = Authority.first if self.path == "/old" else query
            with open("query.tsq", "wb") as file:
                file.write(asked)
            answer = subprocess.run(["openssl", "ts", "-reply", "-config", sys.argv[1], "-queryfile", "query.tsq"],
                                    stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=True).stdout
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(answer)))
        self.end_headers()
        self.wfile.write(answer)

    def log_message(self, *_):
        pass


server = http.server.HTTPServer(("127.0.0.1", 0), Authority)
with open(sys.argv[2] + ".new", "w") as port:
    port.write(str(server.server_port))
os.rename(sys.argv[2] + ".new", sys.argv[2])
server.serve_forever()

// The connection of a page to the server.

const FINAL = {4001: "taken", 4002: "refused", 4003: "unknown", 4004: "mistakes"};   // the page does not connect again
const RETRY = [300, 600, 1200, 2500, 5000];   // ms

export class Connection {
  /** Opens a web socket; `receive` gets each answer, `status` gets "open", "lost", or a value of FINAL. */
  constructor(url, {receive, status}) {
    // With a random name, the page can replace its own lost connection, which the server may still regard as open.
    this.url = `${url}?page=${Math.random().toString(36).slice(2)}`; this.receive = receive; this.status = status;
    this.attempt = 0; this.socket = null;
    this.open();
  }

  open() {
    const socket = this.socket = new WebSocket(this.url);
    socket.onopen = () => this.status("open");
    socket.onmessage = event => {
      this.attempt = 0;      // not in onopen: a full server accepts a connection, and then closes it
      if (socket === this.socket) this.receive(JSON.parse(event.data));
    };
    socket.onclose = event => {
      if (socket !== this.socket) return;
      this.status(FINAL[event.code] || "lost");
      if (!FINAL[event.code]) setTimeout(() => this.open(), RETRY[Math.min(this.attempt++, RETRY.length - 1)]);
    };
  }

  /** Sends a message; false if there is no connection. */
  send(message) {
    if (this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }
}

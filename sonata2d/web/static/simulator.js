// The simulator in a worker of the page; it answers messages as a server does.

export class Simulator {
  /** Starts the worker of a folder, an address that ends in "/"; `receive` gets each answer, also "loading", "ready" and "failed". */
  constructor(folder, receive) {
    this.folder = folder; this.receive = receive;
    this.start();
  }

  start() {
    this.worker = new Worker(new URL("worker.js", new URL(this.folder, location.href)), {type: "module"});
    this.worker.onmessage = event => { const answer = JSON.parse(event.data); if (answer) this.receive(answer); };
    this.worker.onerror = event => this.receive({type: "failed", text: event.message || "worker.js cannot be loaded"});
  }

  /** Sends a message. */
  send(message) {
    this.worker.postMessage(JSON.stringify(message));
    return true;
  }

  /** Ends the worker, even in the middle of an endless loop, and starts another one. */
  restart() {
    this.worker.terminate();
    this.start();
  }
}

// The one connection to the viewer program: events in, commands out. It reconnects by itself. The secret for commands
// stands behind the # of the page's address, which `biotac view` printed; the server never sends it.

const RETRY_MS = 1000;

export class Stream {
  // on: { about(facts), update(news), gone() }
  constructor(on) {
    this.on = on;
    this.about = null;
    this.connect();
  }

  connect() {
    const source = new EventSource("events");
    source.addEventListener("about", (event) => {
      this.about = JSON.parse(event.data);
      this.on.about(this.about);
    });
    source.onmessage = (event) => this.on.update(JSON.parse(event.data));
    source.onerror = () => {
      this.on.gone();
      // The browser tries again by itself, except after an answer that it takes for final.
      if (source.readyState === EventSource.CLOSED) setTimeout(() => this.connect(), RETRY_MS);
    };
  }

  // Returns { good, words }.
  async command(name, finger = null, value = null) {
    if (!this.about) return { good: false, words: "Not connected yet." };
    try {
      const answer = await fetch("command", {
        method: "POST",
        headers: { "Content-Type": "application/json", [this.about.token_header]: location.hash.slice(1) },
        body: JSON.stringify({ do: name, finger, value }),
      });
      return { good: answer.ok, words: (await answer.json()).words };
    } catch {
      return { good: false, words: "The viewer program does not answer; start it again." };
    }
  }
}

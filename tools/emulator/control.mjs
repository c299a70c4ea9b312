// How a program feeds the emulated sensors while they are read: a TCP socket on the loopback interface that carries the
// commands of firmware/emu/feed.h, as firmware/port/posix/control.h does. One program at a time.
import net from 'node:net'

const LONGEST = 4096 // room for what came at once: sensors.c

export class Control {
  /** linkBytes(): what the board has sent to its host so far. onFed(): something came. */
  constructor(sensors, linkBytes, onFed) {
    this.sensors = sensors
    this.linkBytes = linkBytes
    this.program = null
    this.server = net.createServer((socket) => {
      this.program?.destroy()
      this.program = socket
      socket.setNoDelay(true)
      socket.on('error', () => {})
      socket.on('close', () => (this.program = this.program === socket ? null : this.program))
      socket.on('data', (chunk) => {
        for (let k = 0; k < chunk.length; k += LONGEST) socket.write(sensors.feed(chunk.subarray(k, k + LONGEST), linkBytes()))
        onFed()
      })
      sensors.feedBegins()
    })
  }

  /** Listen, and say where on stdout. */
  listen() {
    return new Promise((listening) => {
      this.server.listen(0, '127.0.0.1', () => {
        console.log(`control ${this.server.address().port}`)
        listening()
      })
    })
  }

  /** Time stands still. */
  report() {
    if (this.program !== null) {
      const news = this.sensors.report(this.linkBytes())
      if (news.length > 0) this.program.write(news)
    }
  }
}

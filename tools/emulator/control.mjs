// How a program feeds the emulated sensors while they are read: a TCP socket on the loopback interface with
// the messages of firmware/sensor_board/feed.h. One program at a time.
import net from 'node:net'

const LONGEST = 4096 // FED_BYTES of sensors.c

export class Control {
  /** onFed() is called when something came. */
  constructor(sensors, onFed) {
    this.program = null
    sensors.answer = (frame) => this.program?.write(frame)
    this.server = net.createServer((socket) => {
      this.program?.destroy()
      this.program = socket
      socket.setNoDelay(true)
      socket.on('error', () => {})
      socket.on('close', () => (this.program = this.program === socket ? null : this.program))
      socket.on('data', (chunk) => {
        for (let k = 0; k < chunk.length; k += LONGEST) sensors.feed(chunk.subarray(k, k + LONGEST))
        onFed()
      })
      sensors.calls.feed_begin()
    })
  }

  /** Listen, and say where on stdout. */
  async listen() {
    await new Promise((listening) => this.server.listen(0, '127.0.0.1', listening))
    console.log(`control ${this.server.address().port}`)
  }
}

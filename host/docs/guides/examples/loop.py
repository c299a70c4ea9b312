"""asyncio: frames without blocking the event loop. python loop.py [PORT]"""

import asyncio
import sys

import biotac


async def main(port: str) -> None:
    frames = 0
    async with biotac.aio.open(port) as hand:
        async for batch in hand.batches():
            frames += len(batch.frames)
            if frames >= 300:
                break
        status = await hand.ask(lambda h: h.status())
        print(f"{frames} frames, {hand.stats.frames_lost} lost, board up for {status.uptime_s} s")


asyncio.run(main(sys.argv[1] if len(sys.argv) > 1 else "sim:press.toml"))

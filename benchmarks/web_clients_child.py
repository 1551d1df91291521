"""The browsers of `benchmarks.web_clients`: follow what the page follows, and show nothing.

It prints a line when all have an image, and the bytes that came once its input ends.
"""

import asyncio
import json
import sys
from collections.abc import Callable

import httpx
from websockets.asyncio.client import connect


async def browser(address: str, token: str, ready: Callable[[], object], came: list[int]) -> None:
    """Ask and follow what page.html does, until cancelled."""
    headers = {"Authorization": f"Bearer {token}"}
    async with httpx.AsyncClient(base_url=address, headers=headers, timeout=60.0) as http:
        (await http.get("/")).raise_for_status()
        about = (await http.get("/api/station")).raise_for_status().json()
        follow = ["station/lease", "mico/state", "daqco/display"]
        assert set(about["applications"]) >= {"mico", "daqco", "vico"}
        if (await http.get("/api/campaigns/state")).is_success:
            follow.append("campaigns/state")
        cameras = await http.get("/api/vico/state/camera_handles")
        follow.append(f"vico/camera_handles/{next(iter(cameras.json()))}/shown")
    async with connect(f"{address.replace('http', 'ws')}/api/events", max_size=None) as line:
        await line.send(json.dumps({"token": token, "follow": follow}))
        first = True
        async for message in line:
            image = isinstance(message, bytes)
            came[0] += len(message)
            came[1] += image
            if image and first:
                first = False
                ready()


async def browse(address: str, token: str, count: int) -> None:
    """Be so many browsers until the input ends."""
    came, waiting, all_there = [0, 0], set(range(count)), asyncio.Event()

    def ready(number: int) -> None:
        waiting.discard(number)
        if not waiting:
            all_there.set()

    tasks = [
        asyncio.create_task(browser(address, token, lambda each=each: ready(each), came))
        for each in range(count)
    ]
    there = asyncio.create_task(all_there.wait())
    await asyncio.wait([there, *tasks], return_when=asyncio.FIRST_COMPLETED)
    for each in tasks:
        if each.done():
            each.result()
    came[:] = [0, 0]
    print("there", flush=True)
    await asyncio.to_thread(sys.stdin.read)
    lost = sum(each.done() for each in tasks)
    print(json.dumps({"bytes": came[0], "images": came[1], "lost": lost}), flush=True)
    for each in tasks:
        each.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


if __name__ == "__main__":
    asyncio.run(browse(sys.argv[1], sys.argv[2], int(sys.argv[3])))

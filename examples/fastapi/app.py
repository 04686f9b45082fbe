"""A web service on camkit: a capture comes in, a restored JPEG goes out, or the reason why not.

pip install fastapi uvicorn
uvicorn --app-dir examples/fastapi app:app
curl --fail-with-body -T shot.dng http://127.0.0.1:8000/captures/shot.dng -o shot.jpg
"""

import asyncio
import json
import tempfile
from pathlib import Path

from fastapi import FastAPI, HTTPException, Request, Response
from starlette.requests import ClientDisconnect

import camkit

PLACES, MOST_BYTES, UPLOAD_S = 6, 200_000_000, 60
STATUS = {camkit.MemoryCapError: 507, camkit.WorkerError: 500, TimeoutError: 408}
jobs: dict[str, tuple[int, int]] = {}  # work done, work in all
pool = camkit.WorkerPool("duet", workers=2, size="S", max_mem_bytes=800_000_000)
app = FastAPI()


@app.put("/captures/{key}")
async def restore(key: str, request: Request) -> Response:
    """Return the restored JPEG of a capture; the client chooses its key, such as shot.dng."""
    if key in jobs or len(jobs) >= PLACES:
        raise HTTPException(503, "this key, or every place, is taken", {"Retry-After": "1"})
    jobs[key], gone = (0, 1), asyncio.Event()
    try:
        with tempfile.TemporaryDirectory() as folder:  # goes with the request, however it ends
            shot, made = Path(folder, f"capture{Path(key).suffix}"), Path(folder, "made.jpg")
            async with asyncio.timeout(UPLOAD_S):
                with shot.open("wb") as file:
                    async for piece in request.stream():
                        if file.tell() + len(piece) > MOST_BYTES:
                            raise HTTPException(413, f"an upload has at most {MOST_BYTES} bytes")
                        file.write(piece)
            job = pool.submit(shot, made, cancel=gone, progress=lambda *n: jobs.update({key: n}))
            while not job.done():
                await asyncio.sleep(0.1)
                if await request.is_disconnected():
                    gone.set()
            headers = {"X-Camkit-Warnings": json.dumps(job.result().warnings)}
            return Response(made.read_bytes(), headers=headers, media_type="image/jpeg")
    except (camkit.CamkitError, ClientDisconnect, TimeoutError) as error:
        raise HTTPException(STATUS.get(type(error), 422), str(error).replace(folder, "")) from error
    finally:
        del jobs[key]


@app.get("/captures/{key}")
async def progress(key: str) -> tuple[int, int] | None:
    """Return how much work is done and how much there is in all; null if it is not under way."""
    return jobs.get(key)

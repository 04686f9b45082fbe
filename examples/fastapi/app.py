"""A web service on camkit: a capture comes in, a restored JPEG goes out, or the reason why not.

pip install fastapi uvicorn
uvicorn --app-dir examples/fastapi app:app
curl --fail-with-body -T shot.dng http://127.0.0.1:8000/captures/shot.dng -o shot.jpg
"""

import asyncio
import json
import re
import tempfile
from collections.abc import AsyncIterator
from concurrent.futures.process import BrokenProcessPool
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Annotated

from fastapi import Depends, FastAPI, HTTPException, Request, Response
from starlette.requests import ClientDisconnect
from workers import Workers

import camkit

WORKERS, WAITING = 2, 4  # captures at once, and those that wait; one more is answered by a 503
MOST_BYTES, UPLOAD_S = 200_000_000, 60
jobs: dict[str, float] = {}  # how far each capture is


def check_key(key: str) -> str:
    """Return a key that may name a capture."""
    if not re.fullmatch(r"[\w-]{1,64}\.[A-Za-z0-9]{2,4}", key):
        raise HTTPException(
            422, "a key is a name of letters, digits, _ and -, and a suffix: shot.dng"
        )
    return key


Key = Annotated[str, Depends(check_key)]


@asynccontextmanager
async def lifespan(app: FastAPI) -> AsyncIterator[None]:
    """Start the workers before the first request, and end them behind the last one."""
    app.state.workers = Workers(WORKERS)
    await app.state.workers.ready()
    yield
    app.state.workers.close()


app = FastAPI(lifespan=lifespan)


@app.put("/captures/{key}")
async def restore(key: Key, request: Request) -> Response:
    """Return the restored JPEG of a capture, under a key that the client chooses."""
    if key in jobs:
        raise HTTPException(409, f"{key} is under way; choose another key")
    if len(jobs) >= WORKERS + WAITING:
        raise HTTPException(503, "every place is taken; try again", {"Retry-After": "1"})
    jobs[key] = 0.0
    try:
        with tempfile.TemporaryDirectory() as folder:  # goes with the request, however it ends
            source, picture = Path(folder, f"capture{Path(key).suffix}"), Path(folder, "made.jpg")
            async with asyncio.timeout(UPLOAD_S):
                await receive(request, source)
            workers, tell = request.app.state.workers, lambda share: jobs.update({key: share})
            warnings = await workers.make(source, picture, tell, request.is_disconnected)
            headers = {"X-Camkit-Warnings": json.dumps(warnings)}
            return Response(picture.read_bytes(), headers=headers, media_type="image/jpeg")
    except TimeoutError:
        raise HTTPException(408, f"the upload took more than {UPLOAD_S} s") from None
    except (camkit.Cancelled, ClientDisconnect):
        return Response(status_code=499)  # nobody reads it
    except camkit.MemoryCapError as error:
        need_mb = error.need_bytes // 10**6 + 1
        raise HTTPException(507, f"too large for this service: it takes {need_mb} MB") from error
    except camkit.CamkitError as error:
        raise HTTPException(422, str(error).replace(f"{folder}/", "")) from error
    except BrokenProcessPool as error:
        raise HTTPException(500, "two workers ended while they made this capture") from error
    finally:
        del jobs[key]


@app.get("/captures/{key}")
async def progress(key: Key) -> dict[str, float]:
    """Return how far a capture is, 0 to 1."""
    if key not in jobs:
        raise HTTPException(404, f"{key} is not under way")
    return {"share": jobs[key]}


async def receive(request: Request, source: Path) -> None:
    """Write an upload to a file, piece by piece."""
    with source.open("wb") as file:
        async for piece in request.stream():
            if file.tell() + len(piece) > MOST_BYTES:
                raise HTTPException(413, f"an upload has at most {MOST_BYTES} bytes")
            file.write(piece)

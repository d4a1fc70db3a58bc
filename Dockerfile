# Booster Lab with the tested versions, and the expert database of the shipped motions.
#
#     docker build -t booster-lab .
#     docker run --rm -v "$PWD/out:/out" booster-lab cp -r data/expert_db /out
#     docker run --rm -it --network host booster-lab booster-lab curate --no-browser    # http://127.0.0.1:8090/#token=…
#
# Servers listen on the loopback interface alone, so the page needs the host's network; see docs/security.md.
FROM python:3.11-slim-bookworm
RUN apt-get update && apt-get install --yes --no-install-recommends git make libgl1 libegl1 libglib2.0-0 \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /booster-lab
COPY pyproject.toml constraints.txt requirements.lock dagster_location.pth README.md LICENSE Makefile ./
COPY pipeline pipeline
COPY assets assets
RUN make setup PYTHON=python
COPY . .
ENV PATH=/booster-lab/.venv/bin:$PATH
RUN dagster asset materialize --select expert_db
CMD ["booster-lab", "--help"]

# The README's two commands on a bare machine: docker build -t shared-control . && docker run shared-control make test
FROM python:3.11-slim

RUN apt-get update && apt-get install -y --no-install-recommends make git chromium chromium-driver && rm -rf /var/lib/apt/lists/*
WORKDIR /project
COPY . .
RUN make install
CMD ["make", "reproduce"]

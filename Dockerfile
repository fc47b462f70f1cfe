# The same installation as `make demo` does, without the editing: pip with the pinned versions; the build hook brings Node along.
#   docker build -t catgraph .
#   docker run --rm -it -p 8000:8000 -p 8001:8001 -v catgraph:/data catgraph
#   docker run … catgraph serve --host 0.0.0.0 --data /data --vehicle ws://car:9090
# Port 8000 is the page, over HTTPS by the server's own authority, which the volume keeps; 8001 explains how a phone comes
# to trust it. Behind a proxy that has a certificate: --tls off, and --name https://its.name.

FROM python:3.11-slim-bookworm AS build
WORKDIR /src
COPY . .
RUN python -m venv /opt/catgraph \
 && /opt/catgraph/bin/python -m pip install --no-cache-dir -c constraints.txt '.[fleet,store]'

FROM python:3.11-slim-bookworm
RUN useradd --system --uid 10001 --create-home catgraph \
 && install -d -o catgraph -g catgraph /data
COPY --from=build /opt/catgraph /opt/catgraph
ENV PATH=/opt/catgraph/bin:$PATH \
    PYTHONUNBUFFERED=1
USER catgraph
WORKDIR /data
VOLUME /data
EXPOSE 8000 8001
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=10s --timeout=5s --start-period=10s --retries=3 CMD ["catgraph", "health"]
CMD ["catgraph", "serve", "--host", "0.0.0.0", "--data", "/data"]

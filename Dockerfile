# The same installation as `make demo` does, without the editing: pip with the pinned versions; the build hook brings Node along.
#   docker build -t catgraph .
#   docker run --rm -p 8000:8000 -v catgraph:/data catgraph serve --host 0.0.0.0 --data /data --vehicle ws://car:9090
# The phone's position and Web Share need HTTPS: put a proxy with a certificate in front.

FROM python:3.11-slim-bookworm AS build
WORKDIR /src
COPY . .
RUN python -m venv /opt/catgraph \
 && /opt/catgraph/bin/python -m pip install --no-cache-dir -c constraints.txt .

FROM python:3.11-slim-bookworm
RUN useradd --system --uid 10001 --create-home catgraph \
 && install -d -o catgraph -g catgraph /data
COPY --from=build /opt/catgraph /opt/catgraph
ENV PATH=/opt/catgraph/bin:$PATH \
    PYTHONUNBUFFERED=1
USER catgraph
WORKDIR /data
VOLUME /data
EXPOSE 8000
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=10s --timeout=5s --start-period=10s --retries=3 CMD ["catgraph", "health"]
CMD ["catgraph", "serve", "--host", "0.0.0.0", "--data", "/data"]

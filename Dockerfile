# The program in a container, built and installed as on any Debian:
#   docker build -t rotslam .
#   docker run --rm -v "$PWD:/data" rotslam run /data/walk.mp4 --out /data/walk
# Another release: --build-arg BASE=debian:13, ubuntu:24.04, ...
ARG BASE=debian:12
FROM ${BASE} AS build
COPY . /rotslam
RUN cd /rotslam && scripts/package.sh && mkdir /package && cp build/package/rotslam_*.deb /package/

FROM ${BASE}
COPY --from=build /package /package
RUN apt-get update \
  && apt-get install -y --no-install-recommends /package/rotslam_*.deb \
  && rm -rf /package /var/lib/apt/lists/*
WORKDIR /data
ENTRYPOINT ["rotslam"]
CMD ["--help"]

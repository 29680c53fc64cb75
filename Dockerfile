# SPDX-License-Identifier: Apache-2.0
#
# docker build -t kinescope .
# docker run --rm --user "$(id -u):$(id -g)" --volume "$PWD:/data" kinescope run RECORDING
FROM debian:12-slim AS build
WORKDIR /kinescope
COPY setup.sh .
RUN ./setup.sh package
COPY . .
RUN cmake --workflow --preset package

FROM debian:12-slim
COPY --from=build /kinescope/build/package/kinescope_*.deb /tmp/
RUN apt-get update && apt-get install -y --no-install-recommends /tmp/kinescope_*.deb && rm -rf /var/lib/apt/lists/*
WORKDIR /data
ENTRYPOINT ["kinescope"]

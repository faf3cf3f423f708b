# IMDIM on a processor, without torch: meshes and clouds to CAD programs.
#
#   docker build -t imdim .
#   docker run --rm --user "$(id -u)" -v "$PWD:/part" imdim fit bracket.stl
#
# More extras: docker build --build-arg EXTRAS=step,agent -t imdim .
FROM python:3.11-slim AS build
ARG EXTRAS=step
WORKDIR /source
COPY pyproject.toml compiled_build.py constraints.txt README.md LICENSE ./
COPY models models
COPY src src
# kernels are compiled below, where every user finds them
RUN python -m venv /opt/imdim \
    && IMDIM_COMPILE=0 /opt/imdim/bin/pip install --no-cache-dir --disable-pip-version-check -c constraints.txt ".[${EXTRAS}]"

FROM python:3.11-slim
# OpenCASCADE needs libGL
RUN apt-get update \
    && apt-get install -y --no-install-recommends libgl1 \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --create-home imdim \
    && install -d -o imdim -m 1777 /var/cache/imdim /part
COPY --from=build /opt/imdim /opt/imdim
ENV PATH=/opt/imdim/bin:$PATH NUMBA_CACHE_DIR=/var/cache/imdim HOME=/tmp
USER imdim
# what the first fit would compile, for the processor that builds and for whichever user runs it
RUN python -c "import sys; from imdim.delivery.first_run import compile_kernels; compile_kernels(sys.stderr)" \
    && chmod -R a+rwX /var/cache/imdim
WORKDIR /part
ENTRYPOINT ["imdim"]
CMD ["--help"]

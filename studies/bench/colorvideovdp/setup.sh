#!/bin/sh
# Set up an environment of its own for ColorVideoVDP: setup.sh FOLDER [PYTHON]. `make judge` calls it.
#
# PyTorch from the index is built for CUDA and links against 4 GB of libraries that a CPU never calls. Only
# PyTorch itself is installed; libraries without content stand in for the others. x86-64 Linux, gcc, 1.7 GB of disk.
set -e
folder=$1 python=${2:-python3}
here=$(cd "$(dirname "$0")" && pwd)
command -v gcc >/dev/null || { echo "gcc is missing: sudo apt-get install gcc" >&2; exit 1; }
rm -rf "$folder"
"$python" -m venv "$folder"
pip="$folder/bin/pip --quiet --disable-pip-version-check"
$pip install -r "$here/requirements.txt"
$pip install --no-deps torch==2.15.0 torchvision==0.29.2 'nvidia-cuda-runtime==13.2.*' 'nvidia-cuda-cupti==13.2.*' \
    cvvdp==0.5.7 pyfvvdp==1.2.2

libraries=$("$folder/bin/python" -c 'import sysconfig; print(sysconfig.get_paths()["purelib"])')/torch/lib
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for file in torch_cuda torch_python torch_nvshmem torch_cuda_linalg c10_cuda torch_cpu; do
    nm -D --undefined-only "$libraries/lib$file.so"
done | awk '{ sub(/@.*/, "", $2); print $2 }' |
    grep -E '^(cublas|cudnn|cusparse|nccl|nvrtc|nvshmem|cuFile|cusolver|cufft|nvJitLink|pnccl)' | sort -u >"$work/symbols"
{
    echo '#include <stdlib.h>'
    while read -r symbol; do
        case $symbol in
            nvshmem*) echo "char $symbol[65536];" ;; # data
            *) echo "int $symbol(void) { abort(); }" ;;
        esac
    done <"$work/symbols"
} >"$work/symbols.c"
echo 'int enfilade_empty(void) { return 0; }' >"$work/empty.c"
for name in libcusparse.so.12 libcufft.so.12 libcufile.so.0 libcusparseLt.so.0 libnccl.so.2 libcublas.so.13 \
    libcublasLt.so.13 libnvrtc.so.13 libnvshmem_host.so.3 libcusolver.so.12; do
    gcc -shared -fPIC -Wl,-soname,$name -o "$libraries/$name" "$work/empty.c"
done
gcc -shared -fPIC -w -Wl,-soname,libcudnn.so.9 -o "$libraries/libcudnn.so.9" "$work/symbols.c"
"$folder/bin/python" "$here/predict.py" --version >"$work/version"
mv "$work/version" "$folder/.ready"
cat "$folder/.ready"

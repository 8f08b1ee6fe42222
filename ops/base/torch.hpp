#pragma once

// What the project uses of LibTorch: tensors, their functions, autograd and its modes. In place of
// torch/torch.h, whose modules, optimizers and data sets leave work to every file that includes
// them, precompiled or not: a file of one line takes 6.4 s of CPU with that precompiled (GCC 12,
// -O3, LibTorch 1.13) and 2.1 s with this. Files that use a module, an optimizer or an archive
// include its own header besides.
#include <torch/csrc/autograd/autograd.h>
#include <torch/csrc/autograd/custom_function.h>
#include <torch/types.h>
#include <torch/utils.h>

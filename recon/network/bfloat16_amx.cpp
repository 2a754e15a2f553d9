// Compiled for processors with AMX and AVX512-BF16, whatever the rest is compiled for.
#include "recon/network/bfloat16_arithmetic.h"
#include "recon/network/bfloat16_tiles.h"

#if defined(__AMX_BF16__) && defined(__AVX512BF16__)
#include <sys/syscall.h>
#include <unistd.h>

namespace lumen {
namespace {

struct AmxTiles {
  // Every tile whole, as Intel's palette 1 has them.
  struct alignas(64) Shapes {
    uint8_t palette = 1, first_row = 0, reserved[14] = {};
    uint16_t row_bytes[16] = {64, 64, 64, 64, 64, 64, 64, 64};
    uint8_t rows[16] = {16, 16, 16, 16, 16, 16, 16, 16};
  };
  // Once a thread: nothing else in the program uses tiles.
  static void Prepare() {
    thread_local bool prepared = false;
    if (prepared) return;
    static constexpr Shapes kShapes;
    asm volatile("ldtilecfg %0" : : "m"(kShapes));
    prepared = true;
  }
  // In assembly, as the compiler's own functions take a tile's number as text only.
  template <int kTileNumber>
  static void Load(const void* from, size_t stride) {
    asm volatile("tileloadd (%0,%1,1), %%tmm%c2"
                 :
                 : "r"(from), "r"(stride * sizeof(uint32_t)), "i"(kTileNumber)
                 : "memory");
  }
  template <int kTileNumber>
  static void Store(void* to, size_t stride) {
    asm volatile("tilestored %%tmm%c2, (%0,%1,1)"
                 :
                 : "r"(to), "r"(stride * sizeof(uint32_t)), "i"(kTileNumber)
                 : "memory");
  }
  template <int kSum, int kA, int kB>
  static void AddProducts() {
    asm volatile("tdpbf16ps %%tmm%c2, %%tmm%c1, %%tmm%c0" : : "i"(kSum), "i"(kA), "i"(kB));
  }
};

// Linux gives a process the room that tiles take in its saved state when it asks for it.
bool MayUseTiles() {
  constexpr long kRequestPermission = 0x1023, kTileData = 18;  // ARCH_REQ_XCOMP_PERM, XFEATURE_XTILEDATA
  return syscall(SYS_arch_prctl, kRequestPermission, kTileData) == 0;
}

}  // namespace

const Bfloat16Kernels* PermittedAmxBfloat16Kernels() {
  static const bool may = MayUseTiles();
  return may ? &Bfloat16TileLoops<AmxTiles, Avx512Arithmetic>::kKernels : nullptr;
}

}  // namespace lumen

#else

namespace lumen {
const Bfloat16Kernels* PermittedAmxBfloat16Kernels() { return nullptr; }
}  // namespace lumen

#endif

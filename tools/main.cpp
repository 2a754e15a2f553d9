// lumen: renders a colon as an endoscope sees it, reconstructs it, and says by how many millimetres it is
// off.

#include <exception>
#include <iostream>

#include "common/error.h"
#include "tools/options.h"

namespace {

constexpr int kInputAtFault = 1;
constexpr int kUsage = 2;

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Simulates, reconstructs and evaluates colonoscopy sequences.", "lumen"};
  app.require_subcommand(1);
  lumen::AddRender(&app);
  lumen::AddTrain(&app);
  lumen::AddEvaluate(&app);
  lumen::AddLoop(&app);
  lumen::AddExport(&app);
  lumen::AddImport(&app);
  lumen::AddCheck(&app);
  lumen::AddPhotometry(&app);
  lumen::AddCalibrate(&app);
  lumen::AddCost(&app);
  lumen::AddBudget(&app);
  lumen::AddTable(&app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kUsage;
  } catch (const lumen::InputError& error) {
    std::cerr << "lumen: " << error.what() << "\n";
    return kInputAtFault;
  } catch (const std::exception& error) {
    std::cerr << "lumen: a defect in lumen itself, please report it: " << error.what() << "\n";
    return kInputAtFault;
  }
  return 0;
}

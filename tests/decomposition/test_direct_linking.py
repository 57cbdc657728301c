"""Object files of LLVM's in memory without LLVM, and the processor that they are for."""

import ctypes
import json
import math
import mmap
import os
import sys
from pathlib import Path

import llvmlite.binding as llvm
import pytest

from decomposition import processor
from decomposition.direct_linking import address_in_process, linked

pytestmark = pytest.mark.skipif(os.uname().machine != "x86_64", reason="LLVM links on other processors")

# a constant, a table of addresses, a variable that others set, a call of the C library and one of whoever links
_TEXT = """
@table = internal constant [2 x i64 (i64)*] [i64 (i64)* @first, i64 (i64)* @second]
@kept = common global i64 0, align 8
@weights = internal constant [4 x double] [double 1.5, double 2.0, double 0.25, double 8.0], align 32
declare double @exp(double)
declare i64 @given(i64)
define internal i64 @first(i64 %x) { ret i64 %x }
define internal i64 @second(i64 %x) { %y = mul i64 %x, 7
  ret i64 %y }
define i64 @by_table(i64 %k, i64 %x) {
  %place = getelementptr [2 x i64 (i64)*], [2 x i64 (i64)*]* @table, i64 0, i64 %k
  %f = load i64 (i64)*, i64 (i64)** %place
  %y = call i64 %f(i64 %x)
  ret i64 %y }
define double @weighted(i64 %k, double %x) {
  %place = getelementptr [4 x double], [4 x double]* @weights, i64 0, i64 %k
  %w = load double, double* %place
  %e = call double @exp(double %x)
  %y = fmul double %w, %e
  ret double %y }
define i64 @variable(i64 %x) {
  %v = load i64, i64* @kept
  %g = call i64 @given(i64 %x)
  %y = add i64 %v, %g
  ret i64 %y }
"""
_GIVEN = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(lambda x: 1000 + x)


def _object(codemodel: str = "jitdefault") -> bytes:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_default_triple().create_target_machine(
        reloc="static", codemodel=codemodel, jit=codemodel == "jitdefault"
    )
    return bytes(machine.emit_object(llvm.parse_assembly(_TEXT)))


def _address_of(name: str) -> int | None:
    return ctypes.cast(_GIVEN, ctypes.c_void_p).value if name == "given" else address_in_process(name)


def _function(address: int, result: type, *arguments: type):
    return ctypes.CFUNCTYPE(result, *arguments)(address)


def test_machine_code_runs_where_its_addresses_are_written():
    at = linked(_object(), _address_of)
    whole, number = ctypes.c_int64, ctypes.c_double
    by_table = _function(at["by_table"], whole, whole, whole)
    assert [by_table(k, 6) for k in (0, 1)] == [6, 42]
    weighted = _function(at["weighted"], number, whole, number)
    assert [weighted(k, 0.5) for k in range(4)] == [w * math.exp(0.5) for w in (1.5, 2.0, 0.25, 8.0)]
    variable = _function(at["variable"], whole, whole)
    assert variable(1) == 1001
    ctypes.c_int64.from_address(at["kept"]).value = 5
    assert variable(1) == 1006
    # names of its own are nobody's else, and one more copy has variables of its own
    assert set(at) == {"by_table", "weighted", "variable", "kept"}
    again = linked(_object(), _address_of)
    assert _function(again["variable"], whole, whole)(1) == 1001


def test_machine_code_cannot_be_written_to():
    at = linked(_object(), _address_of)["by_table"] // mmap.PAGESIZE * mmap.PAGESIZE
    (line,) = [it for it in Path("/proc/self/maps").read_text().splitlines() if f"{at:x}-" in it]
    assert line.split()[1] == "r-xp"


@pytest.mark.parametrize("codemodel", ["small", "medium"])
def test_other_addresses_are_left_to_llvm(codemodel):
    assert linked(_object(codemodel), _address_of) is None


def test_what_is_not_known_is_left_to_llvm():
    code = _object()
    assert linked(code, address_in_process) is None
    # of another processor, of another width
    assert linked(code[:18] + b"\xb7\x00" + code[20:], _address_of) is None
    assert linked(code[:4] + b"\x01" + code[5:], _address_of) is None
    assert address_in_process("no_such_function_of_anybody") is None


def test_the_processor_is_asked_for_its_name():
    first, second, *_ = processor.cpuid()
    told = dict(line.split(":", 1) for line in Path("/proc/cpuinfo").read_text().split("\n\n")[0].splitlines())
    told = {name.strip(): value.strip() for name, value in told.items()}
    vendor = b"".join(first[k].to_bytes(4, "little") for k in (1, 3, 2))
    assert vendor.decode() == told["vendor_id"]
    assert second[0] & 15 == int(told["stepping"])
    assert bool(second[2] >> 28 & 1) == ("avx" in told["flags"].split())
    # on every core the same
    assert processor.cpuid() == processor.cpuid()


@pytest.fixture
def asked(monkeypatch, tmp_path):
    """How often LLVM is asked, where its module is not there."""
    times = []
    answer = processor._asked()
    monkeypatch.setattr(processor, "_asked", lambda: times.append(1) or answer)
    monkeypatch.setattr(processor, "folder", lambda: tmp_path)
    monkeypatch.delitem(sys.modules, "llvmlite.binding")
    return times


def test_llvm_is_asked_once_for_the_processor(asked, monkeypatch, tmp_path):
    described = processor.described.__wrapped__
    found = described()
    assert (
        found
        == described()
        == (
            llvm.get_process_triple(),
            llvm.get_host_cpu_name(),
            llvm.get_host_cpu_features().flatten(),
        )
    )
    assert len(asked) == 1
    (kept,) = tmp_path.iterdir()
    text = kept.read_text()
    assert tuple(json.loads(text)[:3]) == found
    # damaged, also where it can be read: kernels of other lanes than are meant would be called
    for times, other in enumerate((text[:40], "5", json.dumps(found), text.replace("64", "65")), start=2):
        kept.write_text(other)
        assert described() == found and len(asked) == times
    # a processor that says anything else of itself, as in a folder of several machines
    monkeypatch.setattr(processor, "cpuid", lambda: [(0, 0, 0, 0)])
    assert described() == found and len(asked) == 6
    assert len(list(tmp_path.iterdir())) == 2


def test_llvm_that_is_there_is_asked(asked, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "llvmlite.binding", llvm)
    processor.described.__wrapped__()
    assert len(asked) == 1 and not list(tmp_path.iterdir())

@echo off
rem Install what is missing, then check style, types, imports and behaviour, and that nothing that is
rem guarded became slower. "test --all" runs the slow tests as well. Other arguments go to pytest.
setlocal enabledelayedexpansion
cd /d "%~dp0" || exit /b 1
set PYTHONDONTWRITEBYTECODE=
call "%~dp0tools\setup.cmd" dev || exit /b 1
set "bin=%venv%\Scripts"
set failed=

call :check "ruff check" "%bin%\ruff.exe" check --quiet .
call :check "ruff format" "%bin%\ruff.exe" format --quiet --check .
call :check "mypy" "%bin%\python.exe" -m mypy
call :check "mypy linux" "%bin%\python.exe" -m mypy --platform linux --cache-dir .mypy_cache/linux
call :check "mypy darwin" "%bin%\python.exe" -m mypy --platform darwin --cache-dir .mypy_cache/darwin
call :check "lint-imports" "%bin%\lint-imports.exe"
call :check "platforms" "%bin%\python.exe" tools/resolve_platforms.py --core --within 12 windows:3.14 aarch64-manylinux_2_39:3.14
if defined failed echo == failed so far: !failed:~2!
if "%~1"=="" goto all
if "%~1"=="--all" goto all
call :check "pytest" "%bin%\python.exe" -m pytest -q -m "not slow" %*
goto end

:all
call :tests "not slow" "pytest"
rem Alone, for it measures.
call :check "guard" "%bin%\python.exe" -m benchmarks.guard
if "%~1"=="--all" call :tests "slow" "slow tests"
if "%~1"=="--all" call :check "all platforms" "%bin%\python.exe" tools/resolve_platforms.py

:end
if defined failed echo == FAILED: !failed:~2!
if defined failed exit /b 1
exit /b 0

:check
echo == %~1
set "name=%~1"
shift
set command=
:arguments
if "%~1"=="" goto carry_out
set command=!command! %1
shift
goto arguments
:carry_out
!command!
if not "!errorlevel!"=="0" set "failed=!failed!, !name!"
exit /b 0

rem Some tests look at the clock: what fails beside others is tried again alone, and fails only if it
rem fails there too.
:tests
echo == %~2
set "pytest="%bin%\python.exe" -m pytest -q -m "%~1""
%pytest% -n auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder
if "!errorlevel!"=="0" exit /b 0
if not "!errorlevel!"=="1" goto tests_failed
echo == once more alone: what failed beside others
%pytest% --last-failed --last-failed-no-failures none
if "!errorlevel!"=="0" exit /b 0
:tests_failed
set "failed=!failed!, %~2"
exit /b 0

@echo off
rem Set-up shared by run.cmd and test.cmd, as tools/setup.sh is by ./run and ./test.
rem "call tools\setup.cmd run" or "... dev" leaves a virtual environment in %venv% that has what
rem pyproject.toml asks for at the versions of constraints.txt; errorlevel 1 where that failed.
for %%i in ("%~dp0..") do set "root=%%~fi"
set "venv=%root%\.venv"
set "stamp=%venv%\.cosmic-%~1"
set "key=%venv%\.cosmic-key"

"%venv%\Scripts\python.exe" "%root%\tools\check_venv.py" place >nul 2>&1 && goto compare
call :find_python || exit /b 1
echo Making the virtual environment .venv ... 1>&2
%python% -m venv --clear "%venv%" || goto no_venv

:compare
rem What an installation depends on; compared with what the last one left.
>"%key%" echo "%root%"
>>"%key%" "%venv%\Scripts\python.exe" --version
>>"%key%" certutil -hashfile "%root%\pyproject.toml" SHA256
>>"%key%" certutil -hashfile "%root%\constraints.txt" SHA256
if not exist "%stamp%" goto install
"%venv%\Scripts\python.exe" "%root%\tools\check_venv.py" packages >nul 2>&1 || goto install
fc /b "%key%" "%stamp%" >nul 2>&1 && exit /b 0

:install
del /q "%venv%\.cosmic-run" "%venv%\.cosmic-dev" 2>nul
set "what=%root%"
if "%~1"=="dev" set "what=%root%[dev]"
echo Installing what CoSMic needs into .venv (the first time takes a minute or more) ... 1>&2
"%venv%\Scripts\python.exe" -m pip install --quiet --no-input --disable-pip-version-check ^
    --constraint "%root%\constraints.txt" --editable "%what%" || goto not_installed
if "%~1"=="run" "%venv%\Scripts\python.exe" "%root%\tools\install_extras.py"
copy /y "%key%" "%venv%\.cosmic-run" >nul
if "%~1"=="dev" copy /y "%key%" "%stamp%" >nul
exit /b 0

rem Sets %python% to an interpreter that is new enough.
:find_python
for %%p in ("py -3" "python" "python3") do (
    %%~p -c "import sys; sys.exit(sys.version_info < (3, 11) or sys.maxsize < 2**32)" >nul 2>&1 && (
        set "python=%%~p"
        exit /b 0
    )
)
echo CoSMic needs a 64 bit Python 3.11 or newer from python.org; install it first. 1>&2
exit /b 1

:no_venv
echo The virtual environment could not be made in %root%. 1>&2
exit /b 1

:not_installed
echo The installation did not succeed: see above; it needs the network the first time. 1>&2
exit /b 1

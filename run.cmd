@echo off
rem Install what is missing, then open the operator window on the simulated platform.
rem Arguments go to cosmic: run --rate 5, run mico, run check FILE, run --help
setlocal
call "%~dp0tools\setup.cmd" run || exit /b 1
"%venv%\Scripts\python.exe" -m cosmic %*
exit /b %errorlevel%
